"""Runs of one case file or thousands: planned, shared out among workers, resumed, and reported by events."""

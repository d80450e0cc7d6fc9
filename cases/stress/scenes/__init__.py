"""The scenarios of the stress map: bodies, media, lights, and what is known of their solutions."""

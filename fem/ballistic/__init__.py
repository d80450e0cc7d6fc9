"""Light before it is scattered: rays refracted, followed, deposited."""

"""Who may speak: certificates of a fleet, passwords and the access list."""

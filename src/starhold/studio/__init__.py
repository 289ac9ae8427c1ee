"""The studio: a page served on this machine, where scenarios are edited, flown, certified and compared."""

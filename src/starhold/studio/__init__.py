"""The studio serves a page on this machine, where scenarios are edited, flown, certified and compared."""

"""The studio serves scenarios, their reports and all that can be asked of them as a page on this machine."""

"""What no scenario holds of this publication."""

"""Laws that hold a spacecraft near a libration point: one law a file, as in the package around it."""

"""Reports of the bodies that have figures or sections of their own."""

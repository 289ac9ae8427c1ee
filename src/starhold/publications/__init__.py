"""The figures and numbers that five publications print are made again and laid beside them."""

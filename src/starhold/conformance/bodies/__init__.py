"""The checks of laws for each body, found by the body's name; `any_body` holds those for all others."""

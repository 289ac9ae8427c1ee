"""The checks of laws for each body, in the module of the body's name; `any_body` holds those for all others."""

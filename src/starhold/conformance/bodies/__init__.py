"""The checks of laws for each body, in the module of the body's name; `any_body` has those for all others."""

"""Imports the packages that only campaigns need when they are used."""

from functools import partial

from starhold.errors import optional

extra = partial(optional, user="campaigns", bundle="campaign")

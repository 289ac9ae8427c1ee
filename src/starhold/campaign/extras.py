"""Packages that only campaigns need, imported when they are used."""

from functools import partial

from starhold.errors import optional

extra = partial(optional, user="campaigns", bundle="campaign")

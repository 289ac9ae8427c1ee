"""One suite of checks for every part and law; the tests run it over all of them, `starhold check-part` over yours."""

"""One suite of checks holds for every part and law; the tests run it over all of them, `starhold check-part` over yours."""

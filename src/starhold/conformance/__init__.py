"""One suite of checks that every law must pass, run by the tests over all laws and by `starhold check-law` over yours."""

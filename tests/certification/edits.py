"""Files of certificates, and ways to change them, for the tests of their checker."""

import copy

from starhold.certification.certificate import write
from starhold.checker import check, check_file


def checked(certificate, folder):
    """What the checker finds in the file of a certificate."""
    write([certificate], "made", folder / "certificate.json")
    return check_file(folder / "certificate.json")


def claims_of(content):
    """The claims of the first certificate by their kinds."""
    return {claim["kind"]: claim for claim in content["certificates"][0]["claims"]}


def with_kinds(content):
    """The content with the list of the claims that are there."""
    for certificate in content["certificates"]:
        certificate["kinds"] = [claim["kind"] for claim in certificate["claims"]]
    return content


def edited(content, place, value):
    """The content with another value in the claim of a kind, or, without one, in the subject."""
    changed = copy.deepcopy(content)
    kind, *path = place
    spot = claims_of(changed)[kind] if kind else changed["certificates"][0]["subject"]
    for key in path[:-1]:
        spot = spot[key]
    spot[path[-1]] = value
    return changed


def content_at(content, path):
    """The value at a path."""
    for key in path:
        content = content[key]
    return content


def replaced(content, path, change):
    """The content after a change at a path, made of the object or list that holds it and the key."""
    changed = copy.deepcopy(content)
    spot = changed
    for key in path[:-1]:
        spot = spot[key]
    change(spot, path[-1])
    return changed


def changed(content, place, value):
    """The content with another value at a place."""
    return replaced(content, place, lambda spot, key: spot.__setitem__(key, value))


def outcomes(content):
    """Kinds of claims to their outcomes."""
    return {claim["kind"]: claim["outcome"] for claim in content["certificates"][0]["claims"]}


def reasons(content):
    """Why something in a file fails."""
    return [finding.reason for finding in check(content) if finding.verdict == "fails"]


def faults(content):
    """Claim and obligation to the reason why it fails."""
    return {(f.claim, f.obligation): f.reason for f in check(content) if f.verdict == "fails"}

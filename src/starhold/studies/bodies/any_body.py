"""The study of a body that has none of its own."""

from starhold.studies.body import BodyStudy

STUDY = BodyStudy()

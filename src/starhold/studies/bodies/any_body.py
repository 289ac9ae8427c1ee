"""The study of a body without a study of its own."""

from starhold.studies.body import BodyStudy

STUDY = BodyStudy()

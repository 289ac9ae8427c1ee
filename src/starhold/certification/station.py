"""Certificates of station-keeping loops: what they speak of, and which claims are made."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from starhold.certification.certificate import BALLS, EXACT, Certificate, Claim, Obligation
from starhold.certification.evidence.finding import certificate
from starhold.certification.evidence.station import UNSHOWN, Station, full_problem
from starhold.certification.openness import assumed_away, named
from starhold.certification.subject import described_gains
from starhold.files import plain_text
from starhold.kernel.check import check
from starhold.kernel.sentences import ASSUMPTIONS
from starhold.laws.point_programs import told
from starhold.loop.closed_loop import ClosedLoop

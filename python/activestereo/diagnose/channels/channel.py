# SPDX-License-Identifier: Apache-2.0
"""The interface of a channel."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from activestereo.common.progress_bar import Progress
from activestereo.diagnose.findings import Explanation, NotRanked
from activestereo.effects import Effect
from activestereo.effects.core.judging import Channel


class JudgingChannel(ABC):
    """Judges the effects of one kind on one kind of evidence, which it is given when it is made; it computes
    nothing before it is asked.
    """

    kind: ClassVar[Channel]

    @abstractmethod
    def explain(self, effects: Sequence[Effect], progress: Progress | None = None) -> list[Explanation | NotRanked]:
        """The explanations by these effects, all of this channel's kind.

        Effects that gain nothing may be left out.
        """

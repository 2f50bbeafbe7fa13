"""Route following: evaluation of the next goal, and the change to it."""

import dataclasses
from collections.abc import Sequence
from concurrent.futures import Executor, Future

from dfvs_core.messages.goal import Goal
from dfvs_core.messages.link import PerceptionReport
from dfvs_core.perception.frame_result import FrameResult
from dfvs_core.perception.goal_preview import GoalPreview, GoalView
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.perception.route import (
    RouteLimits,
    RouteState,
    is_lost,
    may_go_on,
    on_paused_result,
    on_preview,
    on_result,
    wants_preview,
)
from dfvs_core.servo.exchange import Status
from dfvs_core.servo.task import ServoTask
from dfvs_service.perception.assembly import servo_task
from dfvs_service.settings.config import ServiceConfig


class RouteFollower:
    """Where on a route the vehicle is.

    ``goals`` are in the order in which they are to be reached. ``workers`` computes previews of the
    next goal: each costs as much as a match, and no frame must wait for it.
    """

    def __init__(self, config: ServiceConfig, goals: Sequence[Goal], workers: Executor) -> None:
        self._config = config
        self._goals = tuple(goals)
        section = config.route
        self._limits = RouteLimits(section.near_m, section.near_rad, section.min_overlap)
        self._state = RouteState()
        self._workers = workers
        self._ahead: tuple[ServoTask, GoalView] | None = None
        self._evaluation: Future[GoalPreview] | None = None
        self.index = 0

    @property
    def goal(self) -> Goal:
        """Goal at hand."""
        return self._goals[self.index]

    @property
    def count(self) -> int:
        """How many goals there are."""
        return len(self._goals)

    @property
    def is_last(self) -> bool:
        """Whether no goal follows."""
        return self.index == len(self._goals) - 1

    def amend(
        self, report: PerceptionReport, frame_result: FrameResult | None = None
    ) -> PerceptionReport:
        """Report for the gate: how many goals follow; lost if the next is not seen in time."""
        status = None if frame_result is None else frame_result.result.status
        reason = report.reason
        if self.index and (report.healthy or status is Status.NO_OVERLAP):
            place = (
                f"goal {self.index + 1} of the route's {self.count}; "
                "a new start of the service begins at the first"
            )
            reason = f"{reason} ({place})" if reason else place
        left = self.count - 1 - self.index
        if is_lost(self._state, self._limits):
            reason = f"goal {self.index + 2} of the route's {self.count} does not come in sight"
            still = (0.0, 0.0, 0.0, 0.0)
            report = dataclasses.replace(report, velocity=still, healthy=False, lost=True)
        return dataclasses.replace(report, reason=reason, goals_left=left)

    def follow(
        self, frame_result: FrameResult, t_ns: int, *, engaged: bool, paused: bool = False
    ) -> None:
        """Update by a frame's result for the current goal; one that coasts says nothing.

        ``paused``: in a HOLD that may lead on.
        """
        if self.is_last or frame_result.is_coasting:
            return
        result, limits = frame_result.result, self._limits
        if paused:
            self._state = on_paused_result(self._state, limits, result, t_ns)
        else:
            self._state = on_result(self._state, limits, result, t_ns, engaged=engaged)

    def go_on(self, pipeline: Pipeline, t_ns: int) -> bool:
        """Evaluate the next goal if it is time; returns whether it has become the current one."""
        if self.is_last:
            return False
        if self._evaluation is None:
            self._begin_evaluation(pipeline, t_ns)
        if self._evaluation is None or not self._evaluation.done():
            return False
        preview, self._evaluation = self._evaluation.result(), None
        self._state = on_preview(self._state, self._limits, preview.result, t_ns)
        if self._ahead is None or not may_go_on(self._state):
            return False
        pipeline.set_goal(*self._ahead, preview.observation)
        self.index += 1
        self._ahead = None
        self._state = RouteState(self._state.t_ns)
        return True

    def _begin_evaluation(self, pipeline: Pipeline, t_ns: int) -> None:
        """Request a preview of the next goal, if it is time for one."""
        if not wants_preview(self._state, t_ns):
            return
        if self._ahead is None:
            following = self._goals[self.index + 1]
            self._ahead = servo_task(self._config, following), pipeline.prepare(following)
        preview = pipeline.evaluate_next_goal(*self._ahead)
        if preview is not None:
            self._evaluation = self._workers.submit(preview)

"""Plots of a flight: feature error, velocities, pose error and the path in space."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dfvs_sim.demo.flight import FlightLog

_BLUE, _ORANGE, _GREEN, _RED = "#2563a8", "#d97706", "#2f8f4e", "#b3362f"
_STYLE: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.titlesize": 10,
    "legend.frameon": False,
}


def write_plots(log: FlightLog, path: Path) -> Path | None:
    """Write one figure with six plots; None when there is nothing to show."""
    flown = [p for p in log.track.points if p.t_ns >= log.engaged_ns]
    servo = [d for d in log.watch.servo if d["t_capture_ns"] >= log.engaged_ns]
    if not flown or not servo:
        return None
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(12, 7.2), layout="constrained")
        grid = figure.add_gridspec(2, 3)
        t = _seconds([d["t_capture_ns"] for d in servo], log.engaged_ns)
        _feature_error(figure.add_subplot(grid[0, 0]), t, servo)
        _velocities(figure.add_subplot(grid[0, 1]), t, servo)
        _quality(figure.add_subplot(grid[0, 2]), t, servo)
        t_true = _seconds([p.t_ns for p in flown], log.engaged_ns)
        _distance(figure.add_subplot(grid[1, 0]), (t_true, t), flown, servo)
        _angle(figure.add_subplot(grid[1, 1]), (t_true, t), flown, servo)
        _path(figure.add_subplot(grid[1, 2], projection="3d"), log, flown)
        figure.savefig(path, dpi=110)
    return path


def _seconds(times_ns: list[int], zero_ns: int) -> Any:
    return (np.array(times_ns, dtype=np.float64) - zero_ns) * 1e-9


def _series(servo: list[dict[str, Any]], key: str) -> Any:
    return np.array([np.nan if d[key] is None else d[key] for d in servo], dtype=np.float64)


def _label(axes: Any, title: str, y: str) -> None:
    axes.set_title(title, loc="left")
    axes.set_xlabel("time since OFFBOARD (s)")
    axes.set_ylabel(y)


def _feature_error(axes: Any, t: Any, servo: list[dict[str, Any]]) -> None:
    axes.semilogy(t, _series(servo, "feature_error_px"), color=_BLUE, label="flow to the goal")
    axes.semilogy(t, _series(servo, "residual_px"), color=_ORANGE, label="unexplained")
    _label(axes, "Feature error (median)", "px")
    axes.legend()


def _velocities(axes: Any, t: Any, servo: list[dict[str, Any]]) -> None:
    velocity = np.array([d["velocity"] for d in servo])
    names = (("forward", _BLUE), ("right", _ORANGE), ("down", _GREEN))
    for i, (name, colour) in enumerate(names):
        axes.plot(t, velocity[:, i], color=colour, label=f"{name} (m/s)")
    axes.plot(t, velocity[:, 3], color=_RED, ls="--", label="yaw (rad/s)")
    _label(axes, "Commanded velocity", "m/s, rad/s")
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom, top + 0.25 * (top - bottom))  # room for the legend above the lines
    axes.legend(ncols=2, loc="upper right")


def _quality(axes: Any, t: Any, servo: list[dict[str, Any]]) -> None:
    axes.plot(t, _series(servo, "overlap"), color=_BLUE, label="overlap")
    axes.plot(t, _series(servo, "inlier_share"), color=_GREEN, label="inliers")
    axes.set_ylim(0, 1.05)
    _label(axes, "Correspondences and depth", "share")
    depth = axes.twinx()
    depth.plot(t, _series(servo, "depth_m"), color=_ORANGE, label="depth")
    depth.set_ylabel("median depth (m)", color=_ORANGE)
    depth.set_ylim(bottom=0)
    depth.grid(visible=False)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.05))


def _distance(axes: Any, t: tuple[Any, Any], flown: list[Any], servo: list[dict[str, Any]]) -> None:
    axes.semilogy(t[0], [max(p.error_m, 1e-4) for p in flown], color=_BLUE, label="true")
    error, spread = _series(servo, "error_m"), _series(servo, "error_spread_m")
    axes.semilogy(t[1], error, ".", ms=3, color=_ORANGE, label="estimated")
    bottom, _ = axes.get_ylim()  # the lower edge may be negative, which a logarithm cannot show
    lower, upper = np.maximum(error - spread, bottom), error + spread
    label = "± standard deviation"
    axes.fill_between(t[1], lower, upper, color=_ORANGE, alpha=0.25, lw=0, label=label)
    axes.set_ylim(bottom=bottom)
    axes.axhline(0.05, color=_RED, lw=0.8, ls=":")
    _label(axes, "Distance to the goal", "m")
    axes.legend()


def _angle(axes: Any, t: tuple[Any, Any], flown: list[Any], servo: list[dict[str, Any]]) -> None:
    true = np.degrees([max(p.error_rad, 1e-5) for p in flown])
    axes.semilogy(t[0], true, color=_BLUE, label="true, with the body's tilt")
    estimated = np.degrees(_series(servo, "error_rad"))
    axes.semilogy(t[1], estimated, ".", ms=3, color=_ORANGE, label="estimated, yaw alone")
    axes.axhline(1.0, color=_RED, lw=0.8, ls=":")
    _label(axes, "Angle to the goal", "degrees")
    axes.legend()


def _path(axes: Any, log: FlightLog, flown: list[Any]) -> None:
    positions = np.array([p.T_scene_camera[:3, 3] for p in flown])
    north, east, up = positions[:, 0], positions[:, 1], -positions[:, 2]
    axes.plot(east, north, up, color=_BLUE)
    goal = log.plan.T_scene_goal
    axes.scatter(*_plan_view(positions[0]), color=_ORANGE, label="start")
    axes.scatter(*_plan_view(goal[:3, 3]), color=_GREEN, marker="*", s=90, label="goal")
    for T in (flown[0].T_scene_camera, goal):
        ahead = T[:3, 3] + 0.25 * T[:3, 2]
        axes.plot(*np.array([_plan_view(T[:3, 3]), _plan_view(ahead)]).T, color=_RED, lw=1)
    axes.set_title("Path (red: where the camera looks)", loc="left")
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")
    axes.set_zlabel("up (m)")
    _give_height(axes)
    axes.set_aspect("equal")
    axes.zaxis.set_major_locator(MaxNLocator(2))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
        axis.labelpad = 10
    axes.set_box_aspect(axes.get_box_aspect(), zoom=0.85)  # labels stay inside the figure
    axes.legend(loc="upper left")


def _give_height(axes: Any) -> None:
    """Show a third of the width upwards at least, since a level flight leaves no room for ticks."""
    width = max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))
    middle, height = np.mean(axes.get_zlim()), np.ptp(axes.get_zlim())
    half = max(height, width / 3) / 2
    axes.set_zlim(middle - half, middle + half)


def _plan_view(p: Any) -> tuple[float, float, float]:
    return float(p[1]), float(p[0]), float(-p[2])

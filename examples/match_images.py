"""Match two images and draw the matches: match_images.py VIEW GOAL [--fov-deg F] [--out FILE]."""

import argparse
import math

import cv2
import numpy as np

import dfvs


def main() -> None:
    """Print the relative pose of the cameras, and write both images side by side."""
    parser = argparse.ArgumentParser(description="Match two images of one camera.")
    parser.add_argument("view")
    parser.add_argument("goal")
    parser.add_argument("--fov-deg", type=float, default=75.0, help="horizontal field of view")
    parser.add_argument("--model", default="dfvs-flow", help="matcher (default: %(default)s)")
    parser.add_argument("--out", default="matches.png", help="drawing (default: %(default)s)")
    arguments = parser.parse_args()
    try:
        view, goal = dfvs.read_image(arguments.view), dfvs.read_image(arguments.goal)
        height, width = view.shape[:2]
        fov_rad = math.radians(arguments.fov_deg)
        camera = dfvs.CameraModel.from_horizontal_fov(width, height, fov_rad)
        match = dfvs.match_images(dfvs.load_matcher(arguments.model), view, goal, camera)
    except dfvs.DfvsError as error:
        parser.error(str(error))

    print(f"{np.mean(match.flow.confidence > 0.5):.0%} of the view is matched")
    if match.pose is None:
        print("no relative pose")
    else:
        right, down, forward = match.pose.direction
        angle_rad = np.linalg.norm(cv2.Rodrigues(match.pose.R_current_other)[0])
        print(f"towards the goal: right {right:.2f}, down {down:.2f}, forward {forward:.2f}")
        print(f"turned by {np.degrees(angle_rad):.1f} degrees")

    drawing = np.hstack([view, goal])
    at_view, at_goal = match.points()
    for i in range(0, len(at_view), max(len(at_view) // 60, 1)):
        start, end = at_view[i].astype(int), (at_goal[i] + (width, 0)).astype(int)
        cv2.line(drawing, start.tolist(), end.tolist(), (255, 160, 0), 1, cv2.LINE_AA)
    if not cv2.imwrite(arguments.out, drawing[:, :, ::-1]):
        parser.error(f"cannot write {arguments.out}")


if __name__ == "__main__":
    main()

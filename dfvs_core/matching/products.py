"""Matrix products by OpenCV instead of NumPy's BLAS.

BLAS threads spin while they wait for each other: beside a busy neighbour a product of a
tenth of a millisecond takes three to twelve. OpenCV computes these sizes on one thread.
"""

from __future__ import annotations

from typing import TypeVar, cast

import cv2

from dfvs_core.arrays import Float32Array, FloatArray

Matrix = TypeVar("Matrix", Float32Array, FloatArray)


def product(a: Matrix, b: Matrix) -> Matrix:
    """``a @ b`` of two matrices of equal type."""
    return cast(Matrix, cv2.gemm(a, b, 1.0, None, 0.0))  # type: ignore[call-overload]


def inner_product(a: Matrix, b: Matrix) -> Matrix:
    """``a.T @ b``."""
    flags = cv2.GEMM_1_T
    return cast(Matrix, cv2.gemm(a, b, 1.0, None, 0.0, flags=flags))  # type: ignore[call-overload]


def outer_product(a: Matrix, b: Matrix) -> Matrix:
    """``a @ b.T``."""
    flags = cv2.GEMM_2_T
    return cast(Matrix, cv2.gemm(a, b, 1.0, None, 0.0, flags=flags))  # type: ignore[call-overload]

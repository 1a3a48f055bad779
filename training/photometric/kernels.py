"""The photometric error of warped pictures and its derivative as loops, for processors.

What the torch version beside it writes to memory some sixty times stays in registers and cache here: one pass
warps, one compares, one takes the gradient back to depth and motion. Pictures are planar float32.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from training.photometric.constants import C1, C2, MIN_DEPTH_RATIO

_ZERO, _ONE, _TWO = np.float32(0.0), np.float32(1.0), np.float32(2.0)
_NINTH = np.float32(1.0 / 9.0)
_C1, _C2 = np.float32(C1), np.float32(C2)
_NEAR = np.float32(MIN_DEPTH_RATIO)


def _kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile at the first call, keep on disk, run without the GIL; inf and NaN stay what they are.

    Numba watches this file alone: after a change of the constants that it imports, touch it.
    """
    compiled: Callable[..., Any] = njit(
        cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy"
    )(function)
    return compiled


@_kernel
def warp(source, inverse_depth, motion, rebuilt, across, down):  # type: ignore[no-untyped-def]
    """Rebuild one picture, with the slope of the source under each pixel.

    Args:
        source: (C, H, W).
        inverse_depth: (H, W) of the target.
        motion: (3, 4), `pixel_motion`'s.
        rebuilt: (C, H, W), filled.
        across, down: (C, H, W), filled with the change of `rebuilt` for a step of one pixel right and down.
    """
    channels, height, width = source.shape
    right, bottom = np.float32(width - 1), np.float32(height - 1)
    u_row, v_row = np.empty(width, np.float32), np.empty(width, np.float32)
    for i in range(height):
        y = np.float32(i)
        for j in range(width):
            x, q = np.float32(j), inverse_depth[i, j]
            z = motion[2, 0] * x + motion[2, 1] * y + motion[2, 2] + motion[2, 3] * q
            scale = _ONE / z if z > _NEAR else _ZERO
            u = (motion[0, 0] * x + motion[0, 1] * y + motion[0, 2] + motion[0, 3] * q) * scale
            v = (motion[1, 0] * x + motion[1, 1] * y + motion[1, 2] + motion[1, 3] * q) * scale
            u_row[j], v_row[j] = u, v
        for j in range(width):
            # Compared this way round, NaN becomes 0: whatever comes in, no index leaves the picture.
            u = u_row[j] if u_row[j] > _ZERO else _ZERO
            v = v_row[j] if v_row[j] > _ZERO else _ZERO
            u, v = (u if u < right else right), (v if v < bottom else bottom)
            # On the border and beyond, moving changes nothing.
            inside_u = _ONE if _ZERO < u < right else _ZERO
            inside_v = _ONE if _ZERO < v < bottom else _ZERO
            left, top = int(u), int(v)
            next_left, next_top = min(left + 1, width - 1), min(top + 1, height - 1)
            u, v = u - np.float32(left), v - np.float32(top)
            for c in range(channels):
                a, b = source[c, top, left], source[c, top, next_left]
                d, e = source[c, next_top, left], source[c, next_top, next_left]
                upper, lower = a + (b - a) * u, d + (e - d) * u
                rebuilt[c, i, j] = upper + (lower - upper) * v
                across[c, i, j] = ((b - a) + ((e - d) - (b - a)) * v) * inside_u
                down[c, i, j] = (lower - upper) * inside_v


@_kernel
def compare(rebuilt, target, alpha, error, by_mean, by_energy, by_product):  # type: ignore[no-untyped-def]
    """Photometric error of one rebuilt picture y against the target x, and the derivatives of the similarity.

    With B the 3 x 3 mean, T = B(x^2 + y^2) + C1 + C2 and U = B(2 x y) + C1 + C2: n1 = 2 mu_x mu_y + C1,
    n2 = U - n1 (twice the covariance, + C2), d1 = mu_x^2 + mu_y^2 + C1, d2 = T - d1 (the variances, + C2),
    SSIM = n1 n2 / (d1 d2).

    Args:
        rebuilt, target: (C, H, W).
        alpha: share of structure.
        error: (H, W), filled; mean over the channels.
        by_mean, by_energy, by_product: (C, H, W), filled with the derivatives by mu_y, T and U.
    """
    channels, height, width = target.shape
    sum_x, sum_y = np.empty(width + 2, np.float32), np.empty(width + 2, np.float32)
    energy, product = np.empty(width + 2, np.float32), np.empty(width + 2, np.float32)
    half, rest = np.float32(0.5 * alpha / channels), np.float32((1.0 - alpha) / channels)
    error[:] = _ZERO
    for c in range(channels):
        for i in range(height):
            above, below = max(i - 1, 0), min(i + 1, height - 1)
            for j in range(width):
                x0, x1, x2 = target[c, above, j], target[c, i, j], target[c, below, j]
                y0, y1, y2 = rebuilt[c, above, j], rebuilt[c, i, j], rebuilt[c, below, j]
                sum_x[j + 1] = x0 + x1 + x2
                sum_y[j + 1] = y0 + y1 + y2
                energy[j + 1] = x0 * x0 + x1 * x1 + x2 * x2 + y0 * y0 + y1 * y1 + y2 * y2
                product[j + 1] = x0 * y0 + x1 * y1 + x2 * y2
            for row in (sum_x, sum_y, energy, product):
                row[0], row[width + 1] = row[1], row[width]
            for j in range(width):
                mean_x = (sum_x[j] + sum_x[j + 1] + sum_x[j + 2]) * _NINTH
                mean_y = (sum_y[j] + sum_y[j + 1] + sum_y[j + 2]) * _NINTH
                n1 = _TWO * mean_x * mean_y + _C1
                n2 = (product[j] + product[j + 1] + product[j + 2]) * (_TWO * _NINTH) + (_C1 + _C2) - n1
                d1 = mean_x * mean_x + mean_y * mean_y + _C1
                d2 = (energy[j] + energy[j + 1] + energy[j + 2]) * _NINTH + (_C1 + _C2) - d1
                inverse = _ONE / (d1 * d2)
                similarity = n1 * n2 * inverse
                # 1 / d1 = d2 / (d1 d2), and the other way round
                by_first, by_second = similarity * d2 * inverse, similarity * d1 * inverse
                by_product[c, i, j] = n1 * inverse
                by_energy[c, i, j] = -by_second
                by_mean[c, i, j] = _TWO * (mean_x * (n2 - n1) * inverse + mean_y * (by_second - by_first))
                error[i, j] += half * (_ONE - similarity) + rest * abs(rebuilt[c, i, j] - target[c, i, j])


@_kernel
def pull(rebuilt, target, weight, alpha, by_mean, by_energy, by_product, gradient):  # type: ignore[no-untyped-def]
    """Derivative of sum(weight * error) by the rebuilt picture.

    B is symmetric, its borders being repeated, therefore for any weights g
    d(sum g SSIM)/dy = B(g dSSIM/dmu_y) + 2 y B(g dSSIM/dT) + 2 x B(g dSSIM/dU).

    Args:
        rebuilt, target: (C, H, W).
        weight: (H, W).
        alpha, by_mean, by_energy, by_product: `compare`'s.
        gradient: (C, H, W), filled.
    """
    channels, height, width = target.shape
    mean, energy = np.empty(width + 2, np.float32), np.empty(width + 2, np.float32)
    product = np.empty(width + 2, np.float32)
    structure, rest = np.float32(-0.5 * alpha / (9.0 * channels)), np.float32((1.0 - alpha) / channels)
    for c in range(channels):
        for i in range(height):
            above, below = max(i - 1, 0), min(i + 1, height - 1)
            for j in range(width):
                w0, w1, w2 = weight[above, j], weight[i, j], weight[below, j]
                mean[j + 1] = w0 * by_mean[c, above, j] + w1 * by_mean[c, i, j] + w2 * by_mean[c, below, j]
                energy[j + 1] = (
                    w0 * by_energy[c, above, j] + w1 * by_energy[c, i, j] + w2 * by_energy[c, below, j]
                )
                product[j + 1] = (
                    w0 * by_product[c, above, j] + w1 * by_product[c, i, j] + w2 * by_product[c, below, j]
                )
            for row in (mean, energy, product):
                row[0], row[width + 1] = row[1], row[width]
            for j in range(width):
                x, y = target[c, i, j], rebuilt[c, i, j]
                sign = np.float32(y > x) - np.float32(y < x)
                gradient[c, i, j] = weight[i, j] * rest * sign + structure * (
                    (mean[j] + mean[j + 1] + mean[j + 2])
                    + _TWO * y * (energy[j] + energy[j + 1] + energy[j + 2])
                    + _TWO * x * (product[j] + product[j + 1] + product[j + 2])
                )


@_kernel
def pull_back(gradient, across, down, inverse_depth, motion, by_inverse_depth, by_motion):  # type: ignore[no-untyped-def]
    """The gradient of a rebuilt picture taken back to depth and motion.

    Args:
        gradient: (C, H, W), `pull`'s.
        across, down, inverse_depth, motion: `warp`'s.
        by_inverse_depth: (H, W), added to.
        by_motion: (3, 4) float64, added to.
    """
    channels, height, width = gradient.shape
    for i in range(height):
        y = np.float32(i)
        p0 = p1 = p2 = x0 = x1 = x2 = q0 = q1 = q2 = _ZERO
        for j in range(width):
            by_u = by_v = _ZERO
            for c in range(channels):
                by_u += gradient[c, i, j] * across[c, i, j]
                by_v += gradient[c, i, j] * down[c, i, j]
            x, q = np.float32(j), inverse_depth[i, j]
            z = motion[2, 0] * x + motion[2, 1] * y + motion[2, 2] + motion[2, 3] * q
            scale = _ONE / z if z > _NEAR else _ZERO
            u = (motion[0, 0] * x + motion[0, 1] * y + motion[0, 2] + motion[0, 3] * q) * scale
            v = (motion[1, 0] * x + motion[1, 1] * y + motion[1, 2] + motion[1, 3] * q) * scale
            g0, g1 = by_u * scale, by_v * scale
            g2 = -(g0 * u + g1 * v)
            by_inverse_depth[i, j] += g0 * motion[0, 3] + g1 * motion[1, 3] + g2 * motion[2, 3]
            p0, p1, p2 = p0 + g0, p1 + g1, p2 + g2
            x0, x1, x2 = x0 + g0 * x, x1 + g1 * x, x2 + g2 * x
            q0, q1, q2 = q0 + g0 * q, q1 + g1 * q, q2 + g2 * q
        for row, (by_x, by_one, by_q) in enumerate(((x0, p0, q0), (x1, p1, q1), (x2, p2, q2))):
            by_motion[row, 0] += by_x
            by_motion[row, 1] += by_one * y
            by_motion[row, 2] += by_one
            by_motion[row, 3] += by_q


@_kernel
def combine(errors, unwarped, masked, minimum, share, error, teaches, weights):  # type: ignore[no-untyped-def]
    """One error for each pixel out of those of its sources; returns their sum.

    Args:
        errors: (K, H, W).
        unwarped: (H, W); used if `masked`.
        masked: whether a pixel must beat `unwarped` to teach.
        minimum: take the best source, else the mean.
        share: weight of a pixel in the loss.
        error: (H, W), filled.
        teaches: (H, W) bool, filled.
        weights: (K, H, W), filled with the derivative of the loss by each error.
    """
    count, height, width = errors.shape
    total = 0.0
    for i in range(height):
        row_total = np.float32(0.0)
        for j in range(width):
            value, best = errors[0, i, j], 0
            for k in range(1, count):
                if minimum:
                    if errors[k, i, j] < value:
                        value, best = errors[k, i, j], k
                else:
                    value += errors[k, i, j]
            if not minimum:
                value /= np.float32(count)
            teaches[i, j] = not masked or value < unwarped[i, j]
            weight = share if teaches[i, j] else _ZERO
            for k in range(count):
                if minimum:
                    weights[k, i, j] = weight if k == best else _ZERO
                else:
                    weights[k, i, j] = weight / np.float32(count)
            error[i, j] = value if teaches[i, j] else unwarped[i, j]
            row_total += error[i, j]
        total += float(row_total)
    return total


@_kernel
def unwarped(target, sources, alpha, minimum, error):  # type: ignore[no-untyped-def]
    """Error of the sources as they are.

    Args:
        target: (N, C, H, W).
        sources: (K, N, C, H, W).
        alpha, minimum: as above.
        error: (N, H, W), filled.
    """
    count, batch, channels, height, width = sources.shape
    errors = np.empty((count, height, width), np.float32)
    weights, scratch = np.empty_like(errors), np.empty((3, channels, height, width), np.float32)
    teaches = np.empty((height, width), np.bool_)
    for n in range(batch):
        for k in range(count):
            compare(sources[k, n], target[n], alpha, errors[k], scratch[0], scratch[1], scratch[2])
        combine(errors, error[n], False, minimum, _ONE, error[n], teaches, weights)


@_kernel
def explained(  # type: ignore[no-untyped-def]
    target,
    sources,
    inverse_depth,
    motion,
    unwarped,
    masked,
    minimum,
    alpha,
    teaches,
    by_inverse_depth,
    by_motion,
):
    """Mean error of the pictures rebuilt from each source; fills its derivatives by depth and motion.

    Args:
        target: (N, C, H, W).
        sources: (K, N, C, H, W).
        inverse_depth: (N, H, W).
        motion: (K, N, 3, 4).
        unwarped: (N, H, W).
        masked, minimum, alpha: as above.
        teaches: (N, H, W) bool, filled.
        by_inverse_depth: (N, H, W), filled.
        by_motion: (K, N, 3, 4) float64, filled.
    """
    count, batch, channels, height, width = sources.shape
    shape = (count, channels, height, width)
    rebuilt, across, down = (
        np.empty(shape, np.float32),
        np.empty(shape, np.float32),
        np.empty(shape, np.float32),
    )
    by_mean, by_energy = np.empty(shape, np.float32), np.empty(shape, np.float32)
    by_product, gradient = np.empty(shape, np.float32), np.empty(shape[1:], np.float32)
    errors, weights = (
        np.empty((count, height, width), np.float32),
        np.empty((count, height, width), np.float32),
    )
    error = np.empty((height, width), np.float32)
    share = np.float32(1.0 / (batch * height * width))
    by_inverse_depth[:] = _ZERO
    by_motion[:] = 0.0
    total = 0.0
    for n in range(batch):
        for k in range(count):
            warp(sources[k, n], inverse_depth[n], motion[k, n], rebuilt[k], across[k], down[k])
            compare(rebuilt[k], target[n], alpha, errors[k], by_mean[k], by_energy[k], by_product[k])
        total += combine(errors, unwarped[n], masked, minimum, share, error, teaches[n], weights)
        for k in range(count):
            pull(rebuilt[k], target[n], weights[k], alpha, by_mean[k], by_energy[k], by_product[k], gradient)
            pull_back(
                gradient,
                across[k],
                down[k],
                inverse_depth[n],
                motion[k, n],
                by_inverse_depth[n],
                by_motion[k, n],
            )
    return total * share


@_kernel
def variation(disparity, image, by_disparity):  # type: ignore[no-untyped-def]
    """Edge-aware variation of one disparity map; returns it.

    Args:
        disparity: (H, W).
        image: (C, H, W).
        by_disparity: (H, W), filled with the derivative.
    """
    channels, height, width = image.shape
    across = _ONE / np.float32(max(height * (width - 1), 1))
    down = _ONE / np.float32(max((height - 1) * width, 1))
    edges = np.empty(width, np.float32)
    by_disparity[:] = _ZERO
    total = 0.0
    for i in range(height):
        row_total = _ZERO
        for di, dj, part in ((0, 1, across), (1, 0, down)):
            if i + di == height:
                continue
            edges[:] = _ZERO
            for c in range(channels):
                for j in range(width - dj):
                    edges[j] += abs(image[c, i + di, j + dj] - image[c, i, j])
            for j in range(width - dj):
                weight = np.exp(-edges[j] / np.float32(channels)) * part
                step = disparity[i + di, j + dj] - disparity[i, j]
                row_total += weight * abs(step)
                edges[j] = weight * (np.float32(step > _ZERO) - np.float32(step < _ZERO))
            for j in range(width - dj):
                by_disparity[i, j] -= edges[j]
                by_disparity[i + di, j + dj] += edges[j]
        total += float(row_total)
    return total

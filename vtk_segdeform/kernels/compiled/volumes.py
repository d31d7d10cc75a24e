"""Sums over triangles, for `volume`."""

from __future__ import annotations

import math

from .kernels import kernel

_compile = kernel()
# Reassociation allows several partial sums, which halves the time; no other relaxation.
_compile_sums = kernel(fastmath={"reassoc"})


@_compile_sums(
    "const f8[:,:], const i8[:,:], const i8[:], f8[:], i8, i8",
    "const f8[:,:], const i4[:,:], const i8[:], f8[:], i8, i8",
)
def volume_sums(x, faces, begins, out, first, last):
    """Put six times the volume of each block into *out*, blocks first..last.

    The faces of a block are those from *begins*[block] on, up to the next one's.
    """
    ox, oy, oz = x[0, 0], x[0, 1], x[0, 2]
    for block in range(first, last):
        total = 0.0
        for f in range(begins[block], begins[block + 1]):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = x[i, 0] - ox, x[i, 1] - oy, x[i, 2] - oz
            ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            total += ax * (ey * gz - ez * gy) + ay * (ez * gx - ex * gz) + az * (ex * gy - ey * gx)
        out[block] = total


@_compile_sums(
    "const f8[:,:], const i4[:,:], const i8[:], f8[:,:], i8, i8",
    "const f8[:,:], const i8[:,:], const i8[:], f8[:,:], i8, i8",
)
def volume_along_sums(x, faces, begins, out, first, last):
    """Put six times the four coefficients of each block into *out* (blocks, 4); *x* is (n, 6)."""
    ox, oy, oz = x[0, 0], x[0, 1], x[0, 2]
    px, py, pz = x[0, 3], x[0, 4], x[0, 5]
    for block in range(first, last):
        c0 = c1 = c2 = c3 = 0.0
        for f in range(begins[block], begins[block + 1]):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = x[i, 0] - ox, x[i, 1] - oy, x[i, 2] - oz
            ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            ux, uy, uz = x[i, 3] - px, x[i, 4] - py, x[i, 5] - pz
            vx, vy, vz = x[j, 3] - x[i, 3], x[j, 4] - x[i, 4], x[j, 5] - x[i, 5]
            wx, wy, wz = x[k, 3] - x[i, 3], x[k, 4] - x[i, 4], x[k, 5] - x[i, 5]
            nx, ny, nz = ey * gz - ez * gy, ez * gx - ex * gz, ex * gy - ey * gx
            mx = vy * gz - vz * gy + ey * wz - ez * wy
            my = vz * gx - vx * gz + ez * wx - ex * wz
            mz = vx * gy - vy * gx + ex * wy - ey * wx
            qx, qy, qz = vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx
            c0 += ax * nx + ay * ny + az * nz
            c1 += ux * nx + uy * ny + uz * nz + ax * mx + ay * my + az * mz
            c2 += ux * mx + uy * my + uz * mz + ax * qx + ay * qy + az * qz
            c3 += ux * qx + uy * qy + uz * qz
        out[block, 0], out[block, 1], out[block, 2], out[block, 3] = c0, c1, c2, c3


@_compile("const f8[:,:], const i8[:,:], f8[:]")
def determinants(x, corners, out):
    """Write six times the volume of each tetrahedron to *out* (t,)."""
    for t in range(len(corners)):
        i, j, k, d = corners[t, 0], corners[t, 1], corners[t, 2], corners[t, 3]
        ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        fx, fy, fz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        gx, gy, gz = x[d, 0] - x[i, 0], x[d, 1] - x[i, 1], x[d, 2] - x[i, 2]
        out[t] = gx * (ey * fz - ez * fy) + gy * (ez * fx - ex * fz) + gz * (ex * fy - ey * fx)


@_compile("const f8[:,:], const i8[:,:], f8[:,:]", "const f8[:,:], const i4[:,:], f8[:,:]")
def volume_gradient(x, faces, out):
    """Add dV/dx to *out* (n, 3)."""
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        nx, ny, nz = (ey * gz - ez * gy) / 6.0, (ez * gx - ex * gz) / 6.0, (ex * gy - ey * gx) / 6.0
        for corner in (i, j, k):
            out[corner, 0] += nx
            out[corner, 1] += ny
            out[corner, 2] += nz


@_compile_sums(
    "const f8[:,:], const i8[:,:], const f8[:], f8[:,:]",
    "const f8[:,:], const i4[:,:], const f8[:], f8[:,:]",
)
def moment_slopes(x, faces, a, out):
    """Put the sums of det, and of det a . (x_i + x_j + x_k), over all faces into *out* (2, 1 + d).

    And their slopes along the d directions that *x* (n, 3 + 3 d) has behind its first columns.
    """
    out[:, :] = 0.0
    for f in range(len(faces)):
        u, v, w = x[faces[f, 0]], x[faces[f, 1]], x[faces[f, 2]]
        ex, ey, ez = v[0] - u[0], v[1] - u[1], v[2] - u[2]
        gx, gy, gz = w[0] - u[0], w[1] - u[1], w[2] - u[2]
        det = u[0] * (ey * gz - ez * gy) + u[1] * (ez * gx - ex * gz) + u[2] * (ex * gy - ey * gx)
        along = 0.0
        for c in range(3):
            along += a[c] * (u[c] + v[c] + w[c])
        out[0, 0] += det
        out[1, 0] += det * along
        if out.shape[1] == 1:
            continue
        lx, ly, lz = v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]
        mx, my, mz = w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]
        nx, ny, nz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        for k in range(1, out.shape[1]):
            c = 3 * k
            slope = u[c] * lx + u[c + 1] * ly + u[c + 2] * lz
            slope += v[c] * mx + v[c + 1] * my + v[c + 2] * mz
            slope += w[c] * nx + w[c + 1] * ny + w[c + 2] * nz
            moved = 0.0
            for j in range(3):
                moved += a[j] * (u[c + j] + v[c + j] + w[c + j])
            out[0, k] += slope
            out[1, k] += slope * along + det * moved


@_compile(
    "const f8[:,:], const i8[:,:], const f8[:], f8, f8[:,:]",
    "const f8[:,:], const i4[:,:], const f8[:], f8, f8[:,:]",
)
def moment_gradient(x, faces, a, centre, out):
    """Add the derivative of sum det (a . (x_i + x_j + x_k) - 4 centre) / 24 to *out* (n, 3)."""
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        along = -4.0 * centre
        for c in range(3):
            along += a[c] * (x[i, c] + x[j, c] + x[k, c])
        along /= 24.0
        det = 0.0
        for c in range(3):
            d, e = (c + 1) % 3, (c + 2) % 3
            of_i = x[j, d] * x[k, e] - x[j, e] * x[k, d]
            det += x[i, c] * of_i
            out[i, c] += along * of_i
            out[j, c] += along * (x[k, d] * x[i, e] - x[k, e] * x[i, d])
            out[k, c] += along * (x[i, d] * x[j, e] - x[i, e] * x[j, d])
        for c in range(3):
            own = det * a[c] / 24.0
            out[i, c] += own
            out[j, c] += own
            out[k, c] += own


@_compile_sums(
    "const f8[:,:], const i8[:,:], const i8[:], f8[:,:], i8, i8",
    "const f8[:,:], const i4[:,:], const i8[:], f8[:,:], i8, i8",
)
def volume_slopes(x, faces, begins, out, first, last):
    """Put six times the volume of each block, and its slopes along directions, into *out*.

    These are the columns of *x* (n, 3 + 3 d) behind the first three; *out* is (blocks, 1 + d).
    """
    directions, ox, oy, oz = out.shape[1] - 1, x[0, 0], x[0, 1], x[0, 2]
    for block in range(first, last):
        for c in range(directions + 1):
            out[block, c] = 0.0
        total = 0.0
        for f in range(begins[block], begins[block + 1]):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = x[i, 0] - ox, x[i, 1] - oy, x[i, 2] - oz
            ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            nx, ny, nz = ey * gz - ez * gy, ez * gx - ex * gz, ex * gy - ey * gx
            total += ax * nx + ay * ny + az * nz
            u, v, w = x[i], x[j], x[k]
            for c in range(directions):
                d = 3 * c + 3
                out[block, c + 1] += (
                    nx * (u[d] + v[d] + w[d])
                    + ny * (u[d + 1] + v[d + 1] + w[d + 1])
                    + nz * (u[d + 2] + v[d + 2] + w[d + 2])
                )
        out[block, 0] = total


@_compile_sums(
    "const f8[:,:], const i8[:,:], const i8[:], f8[:,:], i8, i8",
    "const f8[:,:], const i4[:,:], const i8[:], f8[:,:], i8, i8",
)
def area_slopes(x, faces, begins, out, first, last):
    """Put twice the area of each block, and its slopes, as `volume_slopes`."""
    directions = out.shape[1] - 1
    for block in range(first, last):
        for c in range(directions + 1):
            out[block, c] = 0.0
        total = 0.0
        for f in range(begins[block], begins[block + 1]):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            nx, ny, nz = ey * gz - ez * gy, ez * gx - ex * gz, ex * gy - ey * gx
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            total += length
            if directions == 0 or length == 0.0:
                continue
            nx, ny, nz = nx / length, ny / length, nz / length
            px, py, pz = gy * nz - gz * ny, gz * nx - gx * nz, gx * ny - gy * nx  # by x_j
            qx, qy, qz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex  # by x_k
            u, v, w = x[i], x[j], x[k]
            for c in range(directions):
                d = 3 * c + 3
                out[block, c + 1] += (
                    px * (v[d] - u[d])
                    + py * (v[d + 1] - u[d + 1])
                    + pz * (v[d + 2] - u[d + 2])
                    + qx * (w[d] - u[d])
                    + qy * (w[d + 1] - u[d + 1])
                    + qz * (w[d + 2] - u[d + 2])
                )
        out[block, 0] = total


@_compile("const f8[:,:], const i8[:,:], f8[:,:]", "const f8[:,:], const i4[:,:], f8[:,:]")
def area_gradient(x, faces, out):
    """Add the derivative of the area to *out* (n, 3)."""
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        nx, ny, nz = ey * gz - ez * gy, ez * gx - ex * gz, ex * gy - ey * gx
        length = 2.0 * math.sqrt(nx * nx + ny * ny + nz * nz)
        if length == 0.0:
            continue
        nx, ny, nz = nx / length, ny / length, nz / length
        px, py, pz = gy * nz - gz * ny, gz * nx - gx * nz, gx * ny - gy * nx
        qx, qy, qz = ny * ez - nz * ey, nz * ex - nx * ez, nx * ey - ny * ex
        out[i, 0] -= px + qx
        out[i, 1] -= py + qy
        out[i, 2] -= pz + qz
        out[j, 0] += px
        out[j, 1] += py
        out[j, 2] += pz
        out[k, 0] += qx
        out[k, 1] += qy
        out[k, 2] += qz


@_compile("const f8[:,:], f8[:], f8[:,:], i8, i8")
def move_along(paths, t, out, start, stop):
    """Put *paths* (n, 3 + 3 c) after the step *t* (c,) along its directions into *out* (n, 3)."""
    for i in range(start, stop):
        row = paths[i]
        x, y, z = row[0], row[1], row[2]
        for k in range(len(t)):
            x += t[k] * row[3 * k + 3]
            y += t[k] * row[3 * k + 4]
            z += t[k] * row[3 * k + 5]
        out[i, 0], out[i, 1], out[i, 2] = x, y, z

"""Sums over triangles, for `volume`."""

from __future__ import annotations

from .kernels import kernel

_compile = kernel()
# Reassociation allows several partial sums, which halves the time; no other relaxation.
_compile_sums = kernel(fastmath={"reassoc"})


@_compile_sums(
    "const f8[:,:], const i8[:,:], f8[:], i8, i8, i8",
    "const f8[:,:], const i4[:,:], f8[:], i8, i8, i8",
)
def volume_sums(x, faces, out, size, first, last):
    """Put six times the volume of each block of *size* faces into *out*, blocks first..last."""
    ox, oy, oz = x[0, 0], x[0, 1], x[0, 2]
    for block in range(first, last):
        total = 0.0
        for f in range(block * size, min((block + 1) * size, len(faces))):
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = x[i, 0] - ox, x[i, 1] - oy, x[i, 2] - oz
            ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            total += ax * (ey * gz - ez * gy) + ay * (ez * gx - ex * gz) + az * (ex * gy - ey * gx)
        out[block] = total


@_compile_sums(
    "const f8[:,:], const i4[:,:], f8[:,:], i8, i8, i8",
    "const f8[:,:], const i8[:,:], f8[:,:], i8, i8, i8",
)
def volume_along_sums(x, faces, out, size, first, last):
    """Put six times the four coefficients of each block into *out* (blocks, 4); *x* is (n, 6)."""
    ox, oy, oz = x[0, 0], x[0, 1], x[0, 2]
    px, py, pz = x[0, 3], x[0, 4], x[0, 5]
    for block in range(first, last):
        c0 = c1 = c2 = c3 = 0.0
        for f in range(block * size, min((block + 1) * size, len(faces))):
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
    "const f8[:,:], const i8[:,:], const f8[:], f8[:]",
    "const f8[:,:], const i4[:,:], const f8[:], f8[:]",
)
def moment_sums(x, faces, a, out):
    """Put the sums of det and of det a . (x_i + x_j + x_k) over all faces into *out* (2,)."""
    total = moment = 0.0
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ex, ey, ez = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        gx, gy, gz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
        det = x[i, 0] * (ey * gz - ez * gy)
        det += x[i, 1] * (ez * gx - ex * gz) + x[i, 2] * (ex * gy - ey * gx)
        along = 0.0
        for c in range(3):
            along += a[c] * (x[i, c] + x[j, c] + x[k, c])
        total += det
        moment += det * along
    out[0], out[1] = total, moment


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


@_compile_sums("f8[:,:], const f8[:,:], f8[:]")
def add_slopes(gradient, paths, out):
    """Add the product of *gradient* (n, 3) and each three columns of *paths* to *out*."""
    for i in range(len(gradient)):
        gx, gy, gz = gradient[i, 0], gradient[i, 1], gradient[i, 2]
        if gx == 0.0 and gy == 0.0 and gz == 0.0:
            continue  # most gradients are those of a part
        row = paths[i]
        for k in range(len(out)):
            out[k] += gx * row[3 * k] + gy * row[3 * k + 1] + gz * row[3 * k + 2]


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

"""Copying inside kernels, element by element: assigning arrays to slices makes numba compile the words of its errors, for seconds."""

from rigidimpulse.core.kernels import jit


@jit
def copy_vector(values, out):
    """Write the first values (k,), k the length of `out`, into out (k,)."""
    for i in range(out.shape[0]):
        out[i] = values[i]


@jit
def copy_matrix(values, out):
    """Write values (k, m) into out (k, m)."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = values[i, j]

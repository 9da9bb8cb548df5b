"""What every layer stands on: compiled kernels, vectors, quaternions, tolerances, errors."""

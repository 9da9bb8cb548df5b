"""Stage `sweep`: when two bodies on their courses first touch.

`impact_time` is the contract, `bisection`, `conservative`, `linear` and `after` are the methods, `guard` and `bound`
what makes the first two safe, and `features` the same for a single pair of features on any prescribed path.
"""

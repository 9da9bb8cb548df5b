"""Time of impact: when two bodies on their trajectories first touch.

`result` is the contract. The methods are `bisection`, `conservative`, `linear` and `end_of_step`. `safe_step` and `motion_bound` are the
conservative bounds that make the first two safe. `feature_paths` does the same for one pair of features on any prescribed path.
"""

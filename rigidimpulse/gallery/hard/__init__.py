"""The hard-case suite: scenes in which engines fail, each with a law or a derived bound. `rigidimpulse hardcases` runs it.

A family is a module of this folder; its scenes are imported when one of them is asked for.
"""

from __future__ import annotations

FAMILIES: dict[str, tuple[str, tuple[str, ...]]] = {
    "stacks": ("Stacks and masonry", ("stack_10", "stack_30", "stack_100", "brick_wall", "arch", "arch_too_thin", "house_of_cards")),
    "struck": ("Struck stacks", ("block_into_stack", "block_into_stack_bouncing", "ball_onto_stack")),
    "mass_ratio": ("Mass ratios", ("heavy_on_light_1e3", "heavy_on_light_1e6", "heavy_dropped_1e3", "heavy_dropped_1e6")),
    "friction": ("Friction", ("incline", "stopping", "sliding_to_rolling", "plate_of_balls", "table")),
    "jointed": ("Joints under load", ("motor_hinge", "chain_hanging", "chain_swinging")),
    "leaving": ("Contact that ends", ("ladder", "ball_off_ball", "rimless_wheel")),
    "bounce": ("Bounces and rocking", ("bounces_to_rest", "rocking_block", "painleve_rod")),
    "spinning": ("Spinning and rolling", ("euler_disk", "coin", "tippe_top", "rattleback")),
    "fast": ("Fast bodies", ("bullet_and_paper", "bullet_and_bullet", "fast_bar", "fast_spin")),
    "ghost": (
        "Internal edges",
        (
            "slide_over_triangles",
            "slide_over_tiles",
            "roll_over_triangles",
            "roll_over_tiles",
            "bounce_over_triangles",
            "bounce_over_tiles",
        ),
    ),
    "tight": ("Spikes, cracks and holes", ("spikes", "wedge_in_crack", "tetrahedra_in_pit", "cube_in_hole")),
    "impossible": ("Impossible starts and ends", ("squeezed_ball", "squeezed_box", "deep_overlap", "coincident", "ball_in_ball")),
    "same_film": ("The same film", ("scale_1e-3", "scale_1e3", "shifted", "rotated", "renamed", "reordered")),
    "meshes": ("Meshes that are not clean", ("dirty_mesh", "flipped_floor", "inside_out", "many_triangles", "needle", "plate")),
    "crowds": ("Crowds", ("balls_216", "balls_216_elastic", "random_impacts", "dominoes", "superellipsoids")),
}
"""Module of each family, with its title and the names of its cases."""

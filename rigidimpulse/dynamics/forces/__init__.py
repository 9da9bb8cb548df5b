"""Stage forces: what accelerates bodies. Modules of forces that vary are imported where a scene has them only."""

KINDS = {
    "ConstantForce": "forces at points",
    "Drag": "drag",
    "EnergyForce": "energy terms",
    "FlexibleBody": "flexible bodies",
    "ForceField": "force fields",
    "PDController": "PD controllers",
    "PointAttractor": "attractors",
    "Spring": "springs",
    "Thruster": "thrusters",
    "HarmonicForce": "harmonic forces",
    "SampledForce": "sampled forces",
}
"""Forces that vary, and what `explain` calls them."""

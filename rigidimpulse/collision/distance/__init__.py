"""How far apart two shapes are."""

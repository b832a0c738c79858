"""Animation files that other programs read: Live Link Face, glTF, npz, BVH, curves."""

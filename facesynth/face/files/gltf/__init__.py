"""glTF 2.0: heads with an animation written, heads of others read."""

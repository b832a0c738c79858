"""The frames of one phone as a map in the plane: embedded, drawn, picked from, drawn into (Deng & Neumann 2008, §4-5)."""

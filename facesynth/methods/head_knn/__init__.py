"""Head motion from the nearest recorded movements (Deng 2006, §4.3)."""

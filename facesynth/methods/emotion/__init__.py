"""Which emotion a voice carries (Cao 2005, §6)."""

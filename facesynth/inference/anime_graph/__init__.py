"""The anime graph: recorded phones found by sound, joined by example, mapped between emotions (Cao 2005)."""

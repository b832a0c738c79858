"""Co-articulation: key shapes blended by learned functions of time (Deng 2006, §5.2)."""

"""Co-articulation: key shapes of phones, blended by functions of time (Deng 2006, §5.2)."""

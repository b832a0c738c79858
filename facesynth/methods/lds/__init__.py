"""The speech-driven linear dynamical system of Saisan, Bissacco, Chiuso and Soatto (2004)."""

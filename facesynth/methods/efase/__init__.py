"""eFASE (Deng & Neumann 2008): constrained dynamic programming over captured motion nodes."""

"""From speech and a method to a face that one can watch."""

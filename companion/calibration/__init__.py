"""`companion calibrate`: a printed board, a lens from pictures of it, a camera's delay from its turning. Shells and their maths."""

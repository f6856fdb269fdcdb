"""Linear algebra that criteria share: inverses, spectra, null spaces, triangles, soft maxima."""

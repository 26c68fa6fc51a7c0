"""Cases, manifests, tracks and samples of them: pure data, no simulator, no pytest."""

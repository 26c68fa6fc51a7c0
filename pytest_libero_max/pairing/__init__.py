"""Playing a pair: Base, the branch point, Dynamic, the proof of the shared prefix, the record."""

"""Statistics: arrays of outcomes in, small frozen results out. Nothing here knows pytest or MuJoCo."""

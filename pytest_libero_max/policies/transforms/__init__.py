"""Steps of adapters: conversions of images, states, texts and actions on the way to a model and back.

Each is a pure function of its arguments and never writes to them. Profiles name them, and an adapter of your
own calls them. :mod:`.steps` has the names.
"""

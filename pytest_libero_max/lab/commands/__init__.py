"""The commands of ``libero-max lab``: a module for each, called like it."""

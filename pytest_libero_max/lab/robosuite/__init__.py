"""robosuite's own tasks as a substrate: five tasks, each with three arms.

=====================  ===========================================================================
``kind``               the entry of the substrate
``robots``             the arms, and a suite for each
``tasks``              the five tasks: what their scenes contain, as data
``environments``       robosuite's environments with spare objects, and their initial states
``world``              a task as a world
``substrate``          builds worlds and keeps those used last
``expert``             a scripted policy that reads the simulator
``door``               its way with the door
=====================  ===========================================================================
"""

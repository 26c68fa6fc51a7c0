"""``servo``: a scripted policy that solves the tasks of two suites by looking at the image.

=====================  ===========================================================================
``servo``              looks, and plans a route where something has moved; the policy
``servo_scenes``       its prior knowledge: cameras, sizes, usual places
``sight``              finding a known object in an image by its colours and its outline
``nominal_camera``     where a point of the world is in the image of the main camera
=====================  ===========================================================================
"""

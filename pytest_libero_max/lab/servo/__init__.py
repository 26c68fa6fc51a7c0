"""``servo``: a scripted policy that solves the tasks of two suites by looking at the image.

=====================  ===========================================================================
``servo``              looks, and plans a route where something has moved; the policy
``servo_scenes``       its prior knowledge: cameras, sizes, usual places
``sight``              the main camera, and finding a known object in its image by colours and outline
=====================  ===========================================================================
"""

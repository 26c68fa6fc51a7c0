"""Images of a world: the GL library, the device, the renderer, contact sheets.

**Drawing several worlds together.** A world draws one image at a time: ``MujocoWorld.observe`` calls
``_image`` for each camera, that calls :meth:`.renderer.Renderer.render`, and its pixels pass through the
world's filters. ``Renderer.render`` has two halves, and the seam for a batch is between them: ``_aim`` sets
the camera and ``_passes`` decides what is drawn (processor alone, no GL; see :mod:`.visibility`), and
``_draw`` copies poses, lights and camera into an ``MjvScene``, renders that and reads it back. Whoever plays
several rollouts in step, under one ``predict_batch``, knows which of them need an image before any is drawn.
Then it takes:

1. ``observe`` in two steps, also in the contract: one that returns an aimed scene for each camera, and one
   that takes pixels and returns the observation, filters and noise included. A genuine world aims at its
   ``_view`` instead of its data, so that half stays its own.
2. A function ``draw(scenes, size) -> (n, H, W, 3)`` beside ``Renderer``: one framebuffer of up to
   ``MAX_SIZE`` x ``MAX_SIZE`` pixels, one viewport for each scene, one ``mjr_readPixels`` for all. At 256
   pixels it holds 256 images, and a GPU waits for one transfer instead of n. Scenes are drawn in the order
   of their uploads (``_Uploaded``: textures and meshes), since each change of those binds another context.
3. The same images: on a processor a picture does not depend on its place in the framebuffer; on a GPU this
   has to be shown, for every driver, with the tests that compare images byte for byte.

A renderer that is no OpenGL (MuJoCo's batch renderers on a GPU) fits behind the same ``draw``, given the
model and the states instead of scenes; its images differ, so it would be named in the fingerprint as
another backend is.
"""

"""Rules for substrates: what a builder of worlds must keep so that a pair measures its event alone."""

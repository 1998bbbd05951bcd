"""Plans the self-motion of redundant arms along a prescribed tool motion."""

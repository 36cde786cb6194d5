"""The paper's experiments, rendered and run through the whole pipeline, its way and ours."""

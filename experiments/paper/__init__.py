"""The paper, reproduced and checked."""

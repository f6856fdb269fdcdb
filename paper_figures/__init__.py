"""The paper's Tables 5 and 6 and Fig. 7, recomputed and set beside the printed ones."""

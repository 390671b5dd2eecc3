"""Long work: training jobs and their queue, uploads and figures in processes of their own."""

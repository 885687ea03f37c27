// SPDX-FileCopyrightText: The Pumice developers
// SPDX-License-Identifier: GPL-3.0-or-later

// A job type of Flamenco 3: the frames of a .blend file, drawn by Pumice, a chunk of them in each task.
//
//     frames "1-30, 40", chunk size 10 ──► frameChunker ──► a task a chunk ──► blender {blenderArgs} FILE … --render-frame 1..10
//
// It differs from Flamenco's own Simple Blender Render in four arguments, all before the frames:
//
//     --engine PUMICE           a node without the extension fails; without this argument Blender draws the proxies with another engine
//     --python-exit-code 1      a node where the next argument fails, fails
//     --python-expr …           settings of the node's extension (memory limit, processor) and samples, where the job sets them
//     chunks of ten frames      an open volume, and what rays need of it, serve all frames of a chunk
//
// It makes no preview video. Copy it into the folder `scripts` beside flamenco-manager, and restart that.

const JOB_TYPE = {
    label: "Pumice Render",
    description: "Render a sequence of frames with Pumice",
    settings: [
        {
            key: "frames", type: "string", required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            evalInfo: { showLinkButton: true, description: "Frames of the scene" },
            description: "Frames to render, such as '47', '1-30' or '3, 5-10, 47-327'",
        },
        {
            key: "chunk_size", type: "int32", default: 10, propargs: { min: 1 }, visible: "submission",
            description: "Frames of one task. Each task opens the volumes anew",
        },
        {
            key: "memory_limit", type: "int32", default: 0, propargs: { min: 0 }, visible: "submission",
            description: "MiB of memory that volumes hold at most on a node; the processor then draws. 0 leaves each node its own preference",
        },
        {
            key: "device", type: "string", choices: ["node", "cpu"], default: "node", visible: "submission",
            description: "The device of each node's preferences, or the processor, whose pictures are the same on all nodes",
        },
        {
            key: "samples", type: "int32", default: 0, propargs: { min: 0 }, visible: "submission",
            description: "Samples per pixel. 0 leaves those of the file",
        },
        {
            key: "render_output_root", type: "string", subtype: "dir_path", required: true, visible: "submission",
            description: "Folder of pictures. Parts that name the job are added to it",
        },
        {
            key: "add_path_components", type: "int32", required: true, default: 0, propargs: { min: 0, max: 32 }, visible: "submission",
            description: "Number of folders above the file that become parts of the path",
        },
        {
            key: "render_output_path", type: "string", subtype: "file_path", editable: false,
            eval: "str(Path(abspath(settings.render_output_root), last_n_dir_parts(settings.add_path_components), jobname, '{timestamp}', '######'))",
            description: "Path of the pictures",
        },
        { key: "blendfile", type: "string", required: true, visible: "web", description: "The file to render" },
        { key: "scene", type: "string", required: true, eval: "C.scene.name", visible: "web", description: "The scene to render" },
        { key: "format", type: "string", required: true, eval: "C.scene.render.image_settings.file_format", visible: "web" },
    ],
};

const VIDEOS = ["FFMPEG", "AVI_RAW", "AVI_JPEG"];

function compileJob(job) {
    const settings = job.settings;
    if (VIDEOS.indexOf(settings.format) >= 0) {
        throw "Pumice Render writes pictures: choose a file format other than " + settings.format;
    }
    if (!settings.render_output_path) {
        throw "Pumice Render needs render_output_path";
    }
    // Flamenco shows the path that is used.
    settings.render_output_path = settings.render_output_path.split("{timestamp}").join(formatTimestampLocal(job.created));
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const task = author.Task("render-" + chunk, "blender");
        task.addCommand(author.Command("blender-render", {
            exe: "{blender}",
            exeArgs: "{blenderArgs}",
            argsBefore: [],
            blendfile: settings.blendfile,
            args: blenderArguments(settings, chunk),
        }));
        job.addTask(task);
    }
}

// What follows the file in a call of Blender, which obeys arguments in their order.
function blenderArguments(settings, chunk) {
    const scene = settings.scene ? ["--scene", settings.scene] : [];
    const code = nodeSettings(settings);
    const python = code ? ["--python-exit-code", "1", "--python-expr", code] : [];
    const frames = ["--render-output", settings.render_output_path, "--render-frame", chunk.split("-").join("..")];
    return scene.concat(["--engine", "PUMICE"], python, frames);
}

// The Python that sets what the job sets; empty where it leaves all as it is.
function nodeSettings(settings) {
    const lines = [];
    if (settings.memory_limit > 0) {
        lines.push("p.memory_limit = " + Math.floor(settings.memory_limit));
    }
    if (settings.device === "cpu") {
        lines.push("p.backend = 'cpu'");
    }
    if (lines.length) {
        // The name of the extension begins with that of the repository that the node has installed it in.
        lines.unshift("p = next(a.preferences for a in bpy.context.preferences.addons if a.module.split('.')[-1] == 'pumice')");
    }
    if (settings.samples > 0) {
        lines.push("bpy.context.scene.pumice.samples = " + Math.floor(settings.samples));
    }
    return lines.length ? ["import bpy"].concat(lines).join("; ") : "";
}

const a=16777216,r=e=>createImageBitmap(e).catch(()=>{throw new Error("This file is not a readable image. Use JPEG or PNG.")});export{a as M,r as p};
